"""Tables of other programs.

readers            CSV, Parquet, MATLAB and TDMS, in pieces
writers, matfile   CSV, Parquet and MATLAB, written as they come
export             a run log as tables, a file a topic
"""
