//! Loops of vertex ids: repeats and keyholes, without coordinates.

/// The loop without corners equal to the one before, around the end too.
pub(super) fn without_repeats(corners: &[u32]) -> Vec<u32> {
    let mut kept = corners.to_vec();
    kept.dedup();
    while kept.len() > 1 && kept.first() == kept.last() {
        kept.pop();
    }
    kept
}

/// Takes a loop apart where it runs along an edge in both directions.
pub(super) fn open_keyholes(corners: &[u32]) -> Vec<Vec<u32>> {
    let mut open = vec![without_repeats(corners)];
    let mut parts = Vec::new();
    while let Some(corners) = open.pop() {
        if corners.len() < 3 {
            continue;
        }
        let Some((i, j)) = doubled_edge(&corners) else {
            parts.push(corners);
            continue;
        };
        // … a | b … | b a …: the part between, and what remains.
        let inner = without_repeats(&corners[i + 1..j]);
        let mut outer = corners[..=i].to_vec();
        outer.extend(corners.iter().skip(j + 2));
        open.push(inner);
        open.push(without_repeats(&outer));
    }
    parts
}

/// The first two edges i < j of a loop between the same corners in opposite
/// directions.
fn doubled_edge(corners: &[u32]) -> Option<(usize, usize)> {
    let n = corners.len();
    let mut edges: Vec<(u32, u32, usize)> = (0..n)
        .map(|i| {
            let (a, b) = (corners[i], corners[(i + 1) % n]);
            (a.min(b), a.max(b), i)
        })
        .collect();
    edges.sort_unstable();
    edges
        .windows(2)
        .filter(|pair| (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1))
        .map(|pair| (pair[0].2, pair[1].2))
        .filter(|&(i, j)| corners[i] != corners[j])
        .min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bridges_to_two_holes_in_a_row_are_opened() {
        // 0 1 2 3 outside, 4 5 6 a hole at 0, 7 8 9 a hole at 5.
        let parts = open_keyholes(&[0, 4, 5, 7, 8, 9, 7, 5, 6, 4, 0, 1, 2, 3]);
        let mut sorted: Vec<Vec<u32>> = parts;
        for part in &mut sorted {
            part.sort_unstable();
        }
        sorted.sort();
        assert_eq!(sorted, [vec![0, 1, 2, 3], vec![4, 5, 6], vec![7, 8, 9]]);
    }

    #[test]
    fn spike_leaves_nothing() {
        assert!(open_keyholes(&[0, 1, 2, 1]).is_empty());
        assert_eq!(open_keyholes(&[0, 1, 2, 1, 3]), [vec![0, 1, 3]]);
    }
}
