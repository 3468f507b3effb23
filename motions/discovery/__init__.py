"""Finding what long recordings hold: cycles, motions that are played once, and stillness, each with a label."""
