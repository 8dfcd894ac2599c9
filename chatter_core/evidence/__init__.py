"""What measurements say of a machine: reading them, and modes, residuals and causes found in them."""
