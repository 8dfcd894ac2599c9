"""Speed and accuracy side by side: `make bench`."""
