"""Pictures of machines and results, drawn with matplotlib, which is imported when one is drawn."""
