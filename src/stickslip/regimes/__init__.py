"""Which motions a system settles on, where they change, and how sticking is kept away."""
