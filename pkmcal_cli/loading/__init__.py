"""Files of the user become machines, tables, start values, poses."""
