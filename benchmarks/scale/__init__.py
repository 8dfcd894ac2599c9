"""What sweeps of many chunks cost beside the physics: the driver's memory and time, requests, files and bytes."""
