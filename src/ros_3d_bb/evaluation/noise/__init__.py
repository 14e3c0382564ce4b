"""The noise analysis of the thesis' chapter 5, for any measurements: `./run noise`."""
