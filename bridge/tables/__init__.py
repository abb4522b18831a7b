"""Tables of other programs.

readers            reading CSV, Parquet, MATLAB and TDMS
writers, matfile   writing CSV, Parquet and MATLAB, in batches of rows
export             a run log as tables, a file for each topic
"""
