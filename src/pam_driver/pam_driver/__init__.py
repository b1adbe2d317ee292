"""CAN bus driver for the valve boards of pneumatic muscles."""
