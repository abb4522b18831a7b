"""How exact `stickslip look` is on drawn rigs that nobody tuned it on, beside eight lines of numpy."""
