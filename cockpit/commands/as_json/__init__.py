"""Results as JSON: the option `--json`, types, and the schemas of the results."""
