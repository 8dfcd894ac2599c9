"""Milling chatter from a bearing's data sheet: the physics, on numpy and scipy alone."""
