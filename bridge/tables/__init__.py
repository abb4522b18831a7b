"""Tables of other programs.

readers            reading any of them; kinds says which it is, table is what comes of it
text               text tables: dialect, encoding, head, rows
sheet, mat, hdf5, tdms, ros_log   workbooks, MATLAB, HDF5, TDMS, messages of ROS 2
cells, unit_words  cells as numbers or times; units as people write them
one_clock          channels of several clocks on one
own_times          channels that have columns of times of their own
writers, matfile   writing CSV, Parquet and MATLAB, in batches of rows
export             a run log as tables, a file for each topic
"""
