//! Symmetric matrices of two and three rows, as their upper triangles by rows.

/// Of 2 × 2: 00, 01, 11.
pub(super) type Sym2 = [f64; 3];
/// Of 3 × 3: 00, 01, 02, 11, 12, 22.
pub(crate) type Sym3 = [f64; 6];

/// A determinant below this share of that of the initial matrix counts as zero.
const SINGULAR: f64 = 1e-9;
/// Share of the initial matrix that is then added.
const LEAST: f64 = 1e-4;

/// The inverse. Where `matrix` is singular, a little of `initial` is added: the fibres of a section may all yield. Real-time: yes.
pub(super) fn inverse2(matrix: Sym2, initial: Sym2) -> Sym2 {
    let det = |m: Sym2| m[0] * m[2] - m[1] * m[1];
    let mut m = matrix;
    if det(m).abs() <= SINGULAR * det(initial) {
        for (entry, least) in m.iter_mut().zip(initial) {
            *entry += LEAST * least;
        }
    }
    let d = det(m);
    [m[2] / d, -m[1] / d, m[0] / d]
}

/// The inverse; none where the determinant vanishes. Real-time: yes.
pub(super) fn inverse3(m: Sym3) -> Option<Sym3> {
    let [a, b, c, d, e, f] = m;
    let (p, q, r) = (d * f - e * e, c * e - b * f, b * e - c * d);
    let det = a * p + b * q + c * r;
    let size = a * d * f;
    let is_regular = det.abs() > 1e-13 * size.abs();
    is_regular.then(|| {
        [
            p / det,
            q / det,
            r / det,
            (a * f - c * c) / det,
            (b * c - a * e) / det,
            (a * d - b * b) / det,
        ]
    })
}

/// m x. Real-time: yes.
pub(super) fn product3(m: &Sym3, x: [f64; 3]) -> [f64; 3] {
    let [a, b, c, d, e, f] = *m;
    [
        a * x[0] + b * x[1] + c * x[2],
        b * x[0] + d * x[1] + e * x[2],
        c * x[0] + e * x[1] + f * x[2],
    ]
}
