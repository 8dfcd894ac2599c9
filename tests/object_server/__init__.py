"""A small S3-speaking server that holds objects in memory, for tests and to try things on this machine."""
