"""What a person looks at before believing a verdict.

choice               which pictures
cycles               cycles laid over their predictions
residuals, axes      residuals over what explains them; which residual over which variable
channel_relations    relations between channels that need no simulation
derivatives          the motion and the derivatives that those need
breakaways           breakaways, and what each could depend on
"""
