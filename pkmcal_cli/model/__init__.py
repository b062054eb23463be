"""The compiled machine: what it is made of, where effects sit, what is observed."""
