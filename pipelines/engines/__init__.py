"""Where stages run: in this process, in workers of this machine, or on a Ray cluster."""
