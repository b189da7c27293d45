"""What goes out: the publishing process and what it says on Zenoh."""
