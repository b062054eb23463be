"""CSV files: dialect, cells, reader, writer; knows nothing of machines."""
