use super::{
    look::{Hue, Key, Look, Marker},
    plot::{Plot, PlotPoint, Series},
};

/// Plots side by side with one legend.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlotFigure {
    /// From left to right.
    pub plots: Vec<Plot>,
    /// The legend, above the plots.
    pub keys: Vec<Key>,
    /// Sentences about the figure, below the legend.
    pub notes: Vec<String>,
}

impl PlotFigure {
    /// Returns the figure with a halo around the points that stand for one of these items, and around `others`.
    #[must_use]
    pub fn lighting(mut self, is_lit: impl Fn(usize) -> bool, others: &[[f64; 2]]) -> Self {
        for plot in &mut self.plots {
            let points = plot.series.iter().filter(|series| series.bar_width.is_none());
            let lit = points.flat_map(|series| &series.points);
            let lit = lit.filter(|point| point.item.is_some_and(&is_lit)).cloned();
            let points: Vec<PlotPoint> = lit.chain(others.iter().copied().map(PlotPoint::from)).collect();
            if !points.is_empty() {
                let look = Look::marker(Hue::Ink, Marker::Halo);
                plot.series.push(Series {
                    points,
                    ..Series::new("lit", look, [])
                });
            }
        }
        self
    }
}

/// Largest number of dots drawn of one cloud; more would not be seen.
const MAX_POINTS: usize = 2000;

/// Places of every this many items, so that at most [`MAX_POINTS`] and the last one remain.
pub(super) fn thinned_places(count: usize) -> impl Iterator<Item = usize> {
    let stride = count.div_ceil(MAX_POINTS).max(1);
    let last = count.checked_sub(1);
    (0..count)
        .step_by(stride)
        .chain(last.filter(|last| !last.is_multiple_of(stride)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_both_ends() {
        let thin: Vec<usize> = thinned_places(12_345).collect();
        assert!(thin.len() <= MAX_POINTS + 1);
        assert_eq!((thin[0], thin[thin.len() - 1]), (0, 12_344));
        assert_eq!(thinned_places(1).collect::<Vec<_>>(), [0]);
        assert_eq!(thinned_places(0).count(), 0);
    }
}
