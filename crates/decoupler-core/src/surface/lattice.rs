/// Largest difference of the coordinates along a line of the lattice, relative to the distance of the nearest neighbours.
const SPREAD: f64 = 0.1;

/// Lines along x and along y in millimetres, ascending, and the index of the point at each node, in the order of the values
/// of a [`SurfaceMap`](super::SurfaceMap): all y of the first x, then those of the next.
type Lattice = ([Vec<f64>; 2], Vec<usize>);

/// Finds the lattice whose nodes are these points (x, y) in any order, in millimetres. Coordinates along a line may differ by
/// up to a tenth of the distance of the nearest neighbours; their mean is used. `None` if the points do not form a
/// lattice: scattered, rotated, or with gaps.
pub(crate) fn lattice(places_mm: &[[f64; 2]]) -> Option<Lattice> {
    if places_mm
        .iter()
        .flatten()
        .any(|coordinate_mm| !coordinate_mm.is_finite())
    {
        return None;
    }
    let nearest_mm = nearest_distance_mm(places_mm);
    let [x, y] = [0, 1].map(|axis| Vec::from_iter(places_mm.iter().map(|place| place[axis])));
    let (x_mm, line_of_x) = lines(&x, nearest_mm)?;
    let (y_mm, line_of_y) = lines(&y, nearest_mm)?;
    if x_mm.len() * y_mm.len() != places_mm.len() {
        return None;
    }
    let mut places = vec![None; places_mm.len()];
    for (place, (ix, iy)) in line_of_x.iter().zip(&line_of_y).enumerate() {
        // There are as many points as nodes: if a node has none, another has two.
        let node = &mut places[ix * y_mm.len() + iy];
        if node.replace(place).is_some() {
            return None;
        }
    }
    let places = places.into_iter().collect::<Option<_>>()?;
    Some(([x_mm, y_mm], places))
}

/// Returns the mean of each line of coordinates along one axis, ascending, and the line of each coordinate; `None` if there
/// are none, or the coordinates of a line differ too much.
fn lines(coordinates_mm: &[f64], nearest_mm: f64) -> Option<(Vec<f64>, Vec<usize>)> {
    let mut order = Vec::from_iter(0..coordinates_mm.len());
    order.sort_by(|&one, &other| coordinates_mm[one].total_cmp(&coordinates_mm[other]));
    let lines = order.chunk_by(|&one, &next| coordinates_mm[next] - coordinates_mm[one] <= 0.5 * nearest_mm);
    let (mut means_mm, mut line_of) = (Vec::new(), vec![0; coordinates_mm.len()]);
    for line in lines {
        let (first_mm, last_mm) = (coordinates_mm[line[0]], coordinates_mm[line[line.len() - 1]]);
        if last_mm - first_mm > SPREAD * nearest_mm {
            return None;
        }
        line.iter().for_each(|&place| line_of[place] = means_mm.len());
        let sum_mm = line.iter().map(|&place| coordinates_mm[place] - first_mm).sum::<f64>();
        means_mm.push(first_mm + sum_mm / line.len() as f64);
    }
    (!means_mm.is_empty()).then_some((means_mm, line_of))
}

/// Distance of the nearest two points; 0 for fewer.
fn nearest_distance_mm(places_mm: &[[f64; 2]]) -> f64 {
    let pairs = places_mm
        .iter()
        .enumerate()
        .flat_map(|(index, one)| places_mm[..index].iter().map(move |other| (one, other)));
    let distances = pairs.map(|(one, other)| (one[0] - other[0]).hypot(one[1] - other[1]));
    distances.reduce(f64::min).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 3 × 4 points in shuffled order, each moved by up to `jitter`.
    fn places(jitter: f64) -> Vec<[f64; 2]> {
        let nodes = (0..12).map(|index| (7 * index + 3) % 12);
        let moved = nodes.enumerate().map(|(number, node)| {
            let [dx, dy] = [number % 3, number % 2].map(|part| jitter * (part as f64 - 0.5));
            [
                10.0 + 2.0 * f64::from(node / 4) + dx,
                -1.0 + 5.0 * f64::from(node % 4) + dy,
            ]
        });
        moved.collect()
    }

    #[test]
    fn a_lattice_is_found_in_any_order_and_within_the_tolerance() {
        for jitter in [0.0, 0.05] {
            let places = places(jitter);
            let ([x_mm, y_mm], order) = lattice(&places).unwrap();
            assert_eq!((x_mm.len(), y_mm.len()), (3, 4));
            let nodes = x_mm.iter().flat_map(|x| y_mm.iter().map(move |y| [*x, *y]));
            for (node, &place) in nodes.zip(&order) {
                let off = (node[0] - places[place][0]).hypot(node[1] - places[place][1]);
                assert!(off <= 2.0 * jitter, "{node:?} {:?}", places[place]);
            }
        }
        let line = lattice(&[[0.0, 3.0], [0.0, 1.0], [0.0, 2.0]]).unwrap();
        assert_eq!(line, ([vec![0.0], vec![1.0, 2.0, 3.0]], vec![1, 2, 0]));
        assert_eq!(lattice(&[[4.0, 2.0]]).unwrap().1, [0]);
    }

    #[test]
    fn other_points_are_not_a_lattice() {
        let whole = places(0.0);
        assert_eq!(lattice(&[]), None);
        assert_eq!(lattice(&whole[1..]), None, "a gap");
        assert_eq!(lattice(&places(0.2)), None, "beyond the tolerance");
        let turned = whole.iter().map(|[x, y]| [0.9 * x - 0.4 * y, 0.4 * x + 0.9 * y]);
        assert_eq!(lattice(&Vec::from_iter(turned)), None, "turned");
        let offset = (0..12).map(|node| {
            [
                f64::from(node / 4) * 2.0,
                f64::from(node % 4) * 2.0 + f64::from(node / 4 % 2),
            ]
        });
        assert_eq!(lattice(&Vec::from_iter(offset)), None, "every second line is offset");
        let mut twice = whole.clone();
        twice[3] = twice[4];
        assert_eq!(lattice(&twice), None, "a node with two points");
        let mut none = whole;
        none[5][0] = f64::NAN;
        assert_eq!(lattice(&none), None, "a NaN coordinate");
    }
}
