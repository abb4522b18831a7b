"""Errors of `stickslip look` on drawn rigs that were not used to tune it, compared with eight lines of numpy."""
