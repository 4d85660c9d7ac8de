/// Keeps of the points of a line, which runs from left to right, those that are seen: of each column of pixels, `column`
/// wide, the first and the last and between them the lowest and the highest.
pub(super) fn per_pixel(points: Vec<[f64; 2]>, column: f64) -> Vec<[f64; 2]> {
    if !(column.is_finite() && column > 0.0) {
        return points;
    }
    let column_of = |point: &[f64; 2]| (point[0] / column).floor();
    let mut kept = Vec::with_capacity(points.len());
    for points in points.chunk_by(|one, other| column_of(one) == column_of(other)) {
        if points.len() <= 4 {
            kept.extend_from_slice(points);
            continue;
        }
        let by_height = |one: &(usize, &[f64; 2]), other: &(usize, &[f64; 2])| one.1[1].total_cmp(&other.1[1]);
        let numbered = || points.iter().enumerate();
        let lowest = numbered().min_by(by_height).map_or(0, |(place, _)| place);
        let highest = numbered().max_by(by_height).map_or(0, |(place, _)| place);
        let mut places = [0, lowest, highest, points.len() - 1];
        places.sort_unstable();
        for (number, &place) in places.iter().enumerate() {
            if number == 0 || places[number - 1] != place {
                kept.push(points[place]);
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_of_pixels_is_painted_as_with_all_points() {
        let points: Vec<[f64; 2]> = (0..100_000)
            .map(|at| {
                [
                    f64::from(at),
                    if at == 54_321 {
                        9.0
                    } else {
                        (f64::from(at) * 0.37).sin()
                    },
                ]
            })
            .collect();
        let column = 100_000.0 / 700.0;
        let kept = per_pixel(points.clone(), column);
        assert!(kept.len() <= 4 * 701, "{}", kept.len());
        assert!(
            kept.windows(2).all(|pair| pair[0][0] < pair[1][0]),
            "in order, none twice"
        );
        let span = |points: &[[f64; 2]], number: usize| {
            let inside = points.iter().filter(|point| (point[0] / column) as usize == number);
            inside.fold((f64::MAX, f64::MIN), |(low, high), point| {
                (low.min(point[1]), high.max(point[1]))
            })
        };
        for number in (0..700).step_by(23).chain([380]) {
            assert_eq!(span(&kept, number), span(&points, number), "column {number}");
        }
        assert!(kept.iter().any(|point| point[1] == 9.0));
    }

    #[test]
    fn few_points_stay_as_they_are() {
        let points = vec![[0.0, 1.0], [1.0, 2.0], [1.0, 3.0]];
        assert_eq!(per_pixel(points.clone(), 100.0), points);
        assert_eq!(per_pixel(points.clone(), 0.0), points);
        assert_eq!(per_pixel(points.clone(), f64::NAN), points);
    }
}
