"""Pictures with which an engineer can check a verdict.

choice               which pictures a diagnosis shows
cycles               measured and predicted cycles in one picture
residuals, axes      residuals over the variable that explains them; which residual over which variable
channel_relations    relations between channels that need no simulation
derivatives          the motion and the derivatives that the relations need
breakaways           breakaways, and the variables that each could depend on
"""
