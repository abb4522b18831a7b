"""What is wrong with a log: its bytes and schemas, its signals' ranges, and all findings together in `log_check`."""
