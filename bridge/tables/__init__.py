"""Tables of other programs.

readers            reading a table of any format; kinds detects the format, table holds the result
text/              text tables: dialect, encoding, head, rows
sheet, mat, tdms, ros_log   workbooks, MATLAB and HDF5, TDMS, messages of ROS 2
cells, unit_words  cells as numbers or times; spellings of units, which units.toml lists
one_clock          channels of several clocks, resampled to one clock
own_times          channels with separate columns of times
writers            writing CSV, Parquet and MATLAB, in batches of rows
export             a run log as tables, a file for each topic
"""
