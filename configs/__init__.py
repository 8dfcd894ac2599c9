"""Configs as shipped: one folder a group, one file a choice."""
