use glam::DVec2;

/// Room between a mark and its label.
const GAP: f64 = 5.0;

/// A label to be placed: the point that it is of, and its width and height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLabel {
    /// Position of the point.
    pub at: DVec2,
    /// Width and height of the label.
    pub size: DVec2,
}

/// Returns places along a line, for labels to keep clear of.
pub fn along(line: &[DVec2]) -> impl Iterator<Item = DVec2> {
    const STEP: f64 = 4.0;
    line.windows(2).flat_map(|ends| {
        let (from, to) = (ends[0], ends[1]);
        let steps = (from.distance(to) / STEP).ceil().clamp(1.0, 1000.0);
        (0..=steps as usize).map(move |step| from.lerp(to, step as f64 / steps))
    })
}

/// Returns the upper left corner of each label next to its point, clear of the other labels and, as far as that is possible,
/// of `marks`, the places that anything else is drawn at; `None` where there is no room between `low` and `high`, the corners of the plot.
///
/// The labels take the best of their places in turn, so that earlier ones are seen where points crowd.
pub fn place_labels(labels: &[PointLabel], marks: &[DVec2], (low, high): (DVec2, DVec2)) -> Vec<Option<DVec2>> {
    let mut placed: Vec<(DVec2, DVec2)> = Vec::new();
    let mut place = |label: &PointLabel| {
        let PointLabel { at, size } = *label;
        let [right, left] = [at.x + GAP, at.x - GAP - size.x];
        let [above, below] = [at.y - GAP - size.y, at.y + GAP];
        let middle = at - 0.5 * size;
        let corners = [
            DVec2::new(right, above),
            DVec2::new(right, middle.y),
            DVec2::new(right, below),
            DVec2::new(left, above),
            DVec2::new(left, middle.y),
            DVec2::new(left, below),
            DVec2::new(middle.x, above),
            DVec2::new(middle.x, below),
        ];
        let is_free = |corner: &DVec2| {
            let end = *corner + size;
            let is_within = corner.cmpge(low).all() && end.cmple(high).all();
            is_within && placed.iter().all(|&(from, to)| !overlap((*corner, end), (from, to)))
        };
        let covered = |corner: &DVec2| {
            let (from, to) = (*corner - 2.0, *corner + size + 2.0);
            marks
                .iter()
                .filter(|mark| mark.cmpge(from).all() && mark.cmple(to).all())
                .count()
        };
        let best = corners.into_iter().filter(is_free).min_by_key(covered)?;
        placed.push((best, best + size));
        Some(best)
    };
    labels.iter().map(&mut place).collect()
}

fn overlap(one: (DVec2, DVec2), other: (DVec2, DVec2)) -> bool {
    one.0.cmplt(other.1).all() && other.0.cmplt(one.1).all()
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: (DVec2, DVec2) = (DVec2::ZERO, DVec2::new(200.0, 100.0));
    const SIZE: DVec2 = DVec2::new(60.0, 12.0);

    fn placed(points: &[[f64; 2]]) -> Vec<Option<DVec2>> {
        let marks: Vec<DVec2> = points.iter().map(|&point| point.into()).collect();
        let labels: Vec<PointLabel> = marks.iter().map(|&at| PointLabel { at, size: SIZE }).collect();
        place_labels(&labels, &marks, FRAME)
    }

    #[test]
    fn labels_lie_in_the_plot_and_clear_of_each_other_and_of_marks() {
        let points = [[10.0, 50.0], [12.0, 54.0], [190.0, 95.0], [198.0, 4.0], [100.0, 50.0]];
        let corners: Vec<DVec2> = placed(&points).into_iter().map(Option::unwrap).collect();
        for (index, &corner) in corners.iter().enumerate() {
            assert!(
                corner.cmpge(FRAME.0).all() && (corner + SIZE).cmple(FRAME.1).all(),
                "{corner}"
            );
            for &other in &corners[..index] {
                assert!(
                    !overlap((corner, corner + SIZE), (other, other + SIZE)),
                    "{corner} {other}"
                );
            }
            for &point in &points {
                let mark = DVec2::from(point);
                assert!(
                    !overlap((corner, corner + SIZE), (mark - 1.0, mark + 1.0)),
                    "{corner} {mark}"
                );
            }
        }
    }

    #[test]
    fn a_label_keeps_clear_of_a_line_through_its_point() {
        let (at, line) = (DVec2::new(100.0, 6.0), [DVec2::new(20.0, 6.0), DVec2::new(180.0, 6.0)]);
        let marks: Vec<DVec2> = along(&line).collect();
        assert_eq!((marks[0], *marks.last().unwrap()), (line[0], line[1]));
        let corner = place_labels(&[PointLabel { at, size: SIZE }], &marks, FRAME)[0].unwrap();
        assert!(corner.y > 6.0, "below, for above is no room: {corner}");
    }

    #[test]
    fn a_label_without_room_is_left_out() {
        let crowd = vec![[100.0, 50.0]; 30];
        let corners = placed(&crowd);
        assert!(corners[0].is_some() && corners[29].is_none());
    }
}
