//! Lines of equal value within one cell of the grid (marching squares).

/// Calls `draw` with the ends of each piece of the line `value = level`. An end is given as
/// `(corner a, corner b, part)`: on the side from a to b, `part` of the way. Corners go round the cell.
pub(super) fn cross_cell(values: [f64; 4], level: f64, mut draw: impl FnMut([(usize, usize, f32); 2])) {
    let mut ends = [(0, 0, 0.0); 4];
    let mut found = 0;
    for a in 0..4 {
        let b = (a + 1) % 4;
        if (values[a] < level) != (values[b] < level) {
            ends[found] = (a, b, ((level - values[a]) / (values[b] - values[a])) as f32);
            found += 1;
        }
    }
    match found {
        2 => draw([ends[0], ends[1]]),
        // A saddle: the middle decides which corners belong together.
        4 => {
            let middle_is_low = values.iter().sum::<f64>() < 4.0 * level;
            let first_is_low = values[0] < level;
            let [w, x, y, z] = ends;
            if middle_is_low == first_is_low {
                draw([w, x]);
                draw([y, z]);
            } else {
                draw([z, w]);
                draw([x, y]);
            }
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pieces(values: [f64; 4]) -> Vec<[(usize, usize, f32); 2]> {
        let mut pieces = Vec::new();
        cross_cell(values, 0.5, |piece| pieces.push(piece));
        pieces
    }

    #[test]
    fn a_slope_is_crossed_once() {
        assert_eq!(pieces([0.0, 1.0, 1.0, 0.0]), [[(0, 1, 0.5), (2, 3, 0.5)]]);
        assert!(pieces([0.0, 0.1, 0.2, 0.3]).is_empty());
    }

    #[test]
    fn a_saddle_is_crossed_twice_around_its_lower_or_upper_corners() {
        // Middle low: the high corners 1 and 3 are cut off.
        assert_eq!(
            pieces([0.0, 0.8, 0.0, 0.8]),
            [[(0, 1, 0.625), (1, 2, 0.375)], [(2, 3, 0.625), (3, 0, 0.375)]]
        );
        // Middle high: the low corners 0 and 2 are.
        assert_eq!(pieces([0.1, 1.0, 0.1, 1.0])[0][0].0, 3);
    }
}
