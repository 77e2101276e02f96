"""Generated C: kernels, header, manifest.  Never edited by hand: `softehl generate`."""
