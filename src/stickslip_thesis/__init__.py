"""The thesis, reproduced: every printed number beside ours, every figure beside its caption."""
