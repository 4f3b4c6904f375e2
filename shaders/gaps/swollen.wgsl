// Ellipsoids so much larger that together they leave no gaps inside the liquid.

fn swollen(splat: Splat) -> Splat {
    var larger = splat;
    larger.diagonal *= CLOSING;
    larger.off_diagonal *= CLOSING;
    return larger;
}
