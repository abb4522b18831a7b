"""Tables of other programs.

readers            reading a table of any format; kinds detects the format, foreign.toml names those that are not read
table, pieces      the result; times that begin again
text/              text tables: dialect, encoding, head, rows
sheet, mat, tdms, json_table, message_log   workbooks, MATLAB and HDF5, TDMS, JSON, messages in MCAP
cells, unit_words  cells as numbers or times; spellings of units, which units.toml lists
one_clock          channels of several clocks, resampled to one clock
own_times          channels with separate columns of times
long_form          tables with one value a row
writers            writing CSV, Parquet and MATLAB, in batches of rows
export             a run log as tables, a file for each topic
"""
