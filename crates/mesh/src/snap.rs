//! Snap rounding: segments with crossings become chains of edges without.
//!
//! Every end point and every crossing makes the pixel it is in *hot*; every
//! segment is then routed through the centres of the hot pixels it meets. Chains
//! meet only in centres or share whole edges, and stay within half a pixel of
//! their segments in each axis (Hobby 1999; Guibas & Marimont 1998).
//!
//! Coordinates are *fine*: a pixel has `2^sub_bits` fine units, so crossings are
//! found before the ends are rounded to pixels. Everything is exact.
//!
//! # No overflow
//!
//! Fine coordinates are at most 2^44 in size, up to rounding ([`MAX_FINE_BITS`]);
//! differences are below 2^46 and fit `i64`; a cross product is below 2^93 and
//! fits `i128`. The quotient in [`scale`] is taken in two steps, whose operands
//! are below `2^22 · 2^93` and `2^24 · 2^93 · 2 = 2^118`. A comparison of two
//! fractions multiplies two differences: below 2^92.

use std::cmp::Ordering;

use antumbra_geom::Stop;
use glam::{DVec2, dvec2};

use crate::grid::Grid;

/// Fine coordinates have at most this many bits and a sign.
pub(crate) const MAX_FINE_BITS: u32 = 44;

/// A point in fine units.
pub(crate) type Fine = [i64; 2];

/// Chains of hot pixels, one per segment.
#[derive(Clone, Debug, Default)]
pub(crate) struct Chains {
    /// The hot pixels, ascending: what chains are made of.
    pub(crate) pixels: Vec<[i64; 2]>,
    /// The pixels of all chains, one after the other, as indices.
    pub(crate) links: Vec<u32>,
    /// Where the chain of each segment ends in `links`.
    pub(crate) ends: Vec<usize>,
}

/// The chain of each segment, or nothing if there would be more than `budget` links or
/// if it was stopped.
///
/// The segments have distinct ends and are in fine units.
pub(crate) fn snap_round(
    segments: &[[Fine; 2]],
    sub_bits: u32,
    budget: usize,
    stop: Stop<'_>,
) -> Option<Chains> {
    let mut pixels = hot_pixels(segments, sub_bits, budget, stop)?;
    pixels.sort_unstable();
    pixels.dedup();

    let centres: Vec<DVec2> = pixels
        .iter()
        .map(|p| dvec2(p[0] as f64, p[1] as f64))
        .collect();
    let grid = Grid::of_points(&centres);
    let mut links = Vec::new();
    let mut ends = Vec::with_capacity(segments.len());
    let mut met: Vec<(i64, u32)> = Vec::new();
    for &[a, b] in segments {
        // Met pixels are disjoint and the segment is monotone, so this key is
        // strictly increasing along the segment.
        let sign = [0, 1].map(|k| (b[k] - a[k]).signum());
        met.clear();
        let [from, to] = [a, b].map(|p| in_pixels(p, sub_bits));
        grid.walk(from, to, 1.0, &mut |cell| {
            for &i in grid.items(cell) {
                let pixel = pixels[i as usize];
                if meets(a, b, pixel, sub_bits) {
                    met.push((sign[0] * pixel[0] + sign[1] * pixel[1], i));
                }
            }
        });
        met.sort_unstable();
        met.dedup();
        links.extend(met.iter().map(|m| m.1));
        ends.push(links.len());
        if links.len() > budget || stop.is_wanted() {
            return None;
        }
    }
    Some(Chains {
        pixels,
        links,
        ends,
    })
}

/// The pixel of a fine point; pixels are closed at their lower sides.
pub(crate) fn pixel_of(p: Fine, sub_bits: u32) -> [i64; 2] {
    p.map(|x| (x + half_pixel(sub_bits)) >> sub_bits)
}

/// The pixels of all ends and all proper crossings, with repetitions.
fn hot_pixels(
    segments: &[[Fine; 2]],
    sub_bits: u32,
    budget: usize,
    stop: Stop<'_>,
) -> Option<Vec<[i64; 2]>> {
    let mut pixels: Vec<[i64; 2]> = segments
        .iter()
        .flatten()
        .map(|&p| pixel_of(p, sub_bits))
        .collect();
    let in_f64: Vec<[DVec2; 2]> = segments
        .iter()
        .map(|s| s.map(|p| in_pixels(p, sub_bits)))
        .collect();
    let grid = Grid::of_segments(&in_f64, 0.01);
    for cell in 0..grid.n_cells() {
        let items = grid.items(cell);
        for (n, &i) in items.iter().enumerate() {
            if stop.is_wanted() {
                return None;
            }
            let s = segments[i as usize];
            for &j in &items[n + 1..] {
                if let Some(pixel) = crossing_pixel(s, segments[j as usize], sub_bits) {
                    pixels.push(pixel);
                }
            }
        }
        if pixels.len() > budget {
            pixels.sort_unstable();
            pixels.dedup();
            if pixels.len() > budget / 2 {
                return None;
            }
        }
    }
    Some(pixels)
}

/// The pixel in which two segments cross in their interiors.
fn crossing_pixel(s: [Fine; 2], t: [Fine; 2], sub_bits: u32) -> Option<[i64; 2]> {
    for k in 0..2 {
        if s[0][k].max(s[1][k]) < t[0][k].min(t[1][k])
            || t[0][k].max(t[1][k]) < s[0][k].min(s[1][k])
        {
            return None;
        }
    }
    if !crosses(s, t) {
        return None;
    }
    let [d, e] = [s, t].map(|[a, b]| minus(b, a));
    let (mut num, mut den) = (cross(minus(t[0], s[0]), e), cross(d, e));
    if den < 0 {
        (num, den) = (-num, -den);
    }
    // Rounding down to fine units first does not change the pixel.
    Some(pixel_of(
        [0, 1].map(|k| s[0][k] + scale(d[k], num, den)),
        sub_bits,
    ))
}

/// Do the segments cross in a point that is an end of neither?
fn crosses(s: [Fine; 2], t: [Fine; 2]) -> bool {
    let opposite = |[a, b]: [Fine; 2], [p, q]: [Fine; 2]| {
        let d = minus(b, a);
        cross(d, minus(p, a)).signum() * cross(d, minus(q, a)).signum() < 0
    };
    opposite(s, t) && opposite(t, s)
}

/// `floor(d num / den)` for positive `den`, where the product may not fit.
fn scale(d: i64, num: i128, den: i128) -> i64 {
    const STEP: u32 = 24;
    let (high, low) = (i128::from(d >> STEP), i128::from(d & ((1 << STEP) - 1)));
    let product = high * num;
    let (quotient, rest) = (product.div_euclid(den), product.rem_euclid(den));
    ((quotient << STEP) + ((rest << STEP) + low * num).div_euclid(den)) as i64
}

/// Has the segment a point in the half-open square of the pixel?
fn meets(a: Fine, b: Fine, pixel: [i64; 2], sub_bits: u32) -> bool {
    // The parameters along the segment for which it is between the sides.
    let mut from = Bound {
        num: 0,
        den: 1,
        is_closed: true,
    };
    let mut to = Bound {
        num: 1,
        den: 1,
        is_closed: true,
    };
    for k in 0..2 {
        let low = (pixel[k] << sub_bits) - half_pixel(sub_bits) - a[k];
        let high = low + (1 << sub_bits);
        let d = b[k] - a[k];
        let (enter, leave) = match d.cmp(&0) {
            Ordering::Equal if low <= 0 && 0 < high => continue,
            Ordering::Equal => return false,
            Ordering::Greater => (
                Bound {
                    num: low,
                    den: d,
                    is_closed: true,
                },
                Bound {
                    num: high,
                    den: d,
                    is_closed: false,
                },
            ),
            Ordering::Less => (
                Bound {
                    num: -high,
                    den: -d,
                    is_closed: false,
                },
                Bound {
                    num: -low,
                    den: -d,
                    is_closed: true,
                },
            ),
        };
        // Of equal bounds the open one is the stricter.
        match enter.cmp(from) {
            Ordering::Greater => from = enter,
            Ordering::Equal => from.is_closed &= enter.is_closed,
            Ordering::Less => {}
        }
        match leave.cmp(to) {
            Ordering::Less => to = leave,
            Ordering::Equal => to.is_closed &= leave.is_closed,
            Ordering::Greater => {}
        }
    }
    match from.cmp(to) {
        Ordering::Less => true,
        Ordering::Equal => from.is_closed && to.is_closed,
        Ordering::Greater => false,
    }
}

/// An end of an interval of parameters: a fraction, which belongs to it or not.
#[derive(Clone, Copy)]
struct Bound {
    num: i64,
    /// Positive.
    den: i64,
    is_closed: bool,
}

impl Bound {
    /// Compares the fractions.
    fn cmp(self, other: Self) -> Ordering {
        let wide = i128::from;
        (wide(self.num) * wide(other.den)).cmp(&(wide(other.num) * wide(self.den)))
    }
}

fn half_pixel(sub_bits: u32) -> i64 {
    (1 << sub_bits) >> 1
}

/// Exact: fine coordinates have fewer bits than a mantissa.
fn in_pixels(p: Fine, sub_bits: u32) -> DVec2 {
    dvec2(p[0] as f64, p[1] as f64) / (1_i64 << sub_bits) as f64
}

fn minus(a: Fine, b: Fine) -> Fine {
    [a[0] - b[0], a[1] - b[1]]
}

/// The cross product of two differences.
fn cross(d: Fine, e: Fine) -> i128 {
    i128::from(d[0]) * i128::from(e[1]) - i128::from(d[1]) * i128::from(e[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quotient_in_two_steps_is_the_quotient() {
        let mut x: i128 = 1;
        for _ in 0..10_000 {
            x = (x * 6_364_136_223_846_793_005 + 1_442_695_040_888_963_407) & ((1 << 62) - 1);
            let den = (x & ((1 << 40) - 1)) + 1;
            let num = (x >> 20) % den;
            let d = ((x >> 17) & ((1 << 45) - 1)) as i64 - (1 << 44);
            assert_eq!(
                i128::from(scale(d, num, den)),
                (i128::from(d) * num).div_euclid(den)
            );
        }
    }

    #[test]
    fn the_largest_coordinates_do_not_overflow() {
        let m = (1_i64 << MAX_FINE_BITS) + (1 << 16);
        let segments = [
            [[-m, -m], [m, m]],
            [[-m, m], [m, -m]],
            [[-m, m - 1], [m, -m]],
            [[-m, 0], [m, 1]],
            [[1, -m], [0, m]],
        ];
        let chains = snap_round(&segments, 16, 1 << 20, Stop::NEVER).unwrap();
        assert_eq!(chains.ends.len(), 5);
        assert!(chains.pixels.contains(&[0, 0]));
    }

    #[test]
    fn a_pixel_is_open_above() {
        // A segment along the upper side of pixel 0 is in pixel 1.
        let s = [[-100, 8], [100, 8]];
        assert!(!meets(s[0], s[1], [0, 0], 4));
        assert!(meets(s[0], s[1], [0, 1], 4));
        // One that touches the upper left corner of pixel (0, 0) meets it not.
        assert!(!meets([-16, 0], [0, 16], [0, 0], 4));
        assert!(meets([-16, 0], [0, -16], [0, 0], 4));
    }
}
