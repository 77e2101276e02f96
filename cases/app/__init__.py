"""The desk of a seal engineer in a browser, on this machine only: `softehl app`."""
