"""Pictures with which an engineer can check a verdict.

choice      which pictures a diagnosis shows; a residual over the variable that explains it
cycles      measured and predicted cycles in one picture
residuals   residuals and the variables that could explain them
"""
