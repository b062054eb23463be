"""Identification on top of the one prediction: residuals, fit, identifiability, sensitivity, hold-out."""
