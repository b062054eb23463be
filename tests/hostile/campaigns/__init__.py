"""Calibration campaigns that lie: tables of machines whose truth is planted, spoilt as engineers spoil them."""
