"""Signal processing that knows no friction: smoothing, differentiation, repairs, clocks."""
