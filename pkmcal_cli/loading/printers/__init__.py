"""Constants of a printer as the files of its firmware state them."""
