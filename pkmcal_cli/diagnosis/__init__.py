"""From the residual to a named physical effect: detection, identification, adaptation (Baarda, Teunissen)."""
