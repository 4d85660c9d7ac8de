/// How a positive quantity grows with a size: which of two laws lies closer to the points, by least squares on the
/// logarithm of the quantity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Growth {
    /// b in t = a·x^b.
    pub exponent: f64,
    /// How far that law is off: root mean square of the residuals of ln t, so 0.01 is about one percent.
    pub power_residual: f64,
    /// By which factor t grows with each unit of x in t = a·c^x.
    pub factor_per_unit: f64,
    /// How far that law is off.
    pub exponential_residual: f64,
}

/// A law of growth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GrowthLaw {
    /// t = a·x^b.
    Power,
    /// t = a·c^x.
    Exponential,
}

impl Growth {
    /// Fits points (x, t); `None` without three different x, or if a number is not positive and finite.
    pub fn fit(points: &[(f64, f64)]) -> Option<Self> {
        let is_sound = |&(x, t): &(f64, f64)| x > 0.0 && t > 0.0 && x.is_finite() && t.is_finite();
        let mut sizes: Vec<f64> = points.iter().map(|point| point.0).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.dedup();
        if sizes.len() < 3 || !points.iter().all(is_sound) {
            return None;
        }
        let (exponent, power_residual) = line(points.iter().map(|(x, t)| (x.ln(), t.ln())));
        let (rate, exponential_residual) = line(points.iter().map(|(x, t)| (*x, t.ln())));
        Some(Self {
            exponent,
            power_residual,
            factor_per_unit: rate.exp(),
            exponential_residual,
        })
    }

    /// The law that lies closer.
    pub fn law(&self) -> GrowthLaw {
        if self.power_residual <= self.exponential_residual {
            GrowthLaw::Power
        } else {
            GrowthLaw::Exponential
        }
    }
}

/// Slope of the line of least squares, and the root mean square of what is left.
fn line(points: impl Iterator<Item = (f64, f64)> + Clone) -> (f64, f64) {
    let mean = |value: fn((f64, f64)) -> f64| {
        let count = points.clone().count() as f64;
        points.clone().map(value).sum::<f64>() / count
    };
    let (mean_x, mean_y) = (mean(|point| point.0), mean(|point| point.1));
    let deviations = points.clone().map(|(x, y)| (x - mean_x, y - mean_y));
    let (above, below) = deviations
        .clone()
        .fold((0.0, 0.0), |(above, below), (x, y)| (above + x * y, below + x * x));
    let slope = above / below;
    let (squares, count) = deviations.fold((0.0, 0.0), |(squares, count), (x, y)| {
        (squares + (y - slope * x).powi(2), count + 1.0)
    });
    (slope, (squares / count).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(law: impl Fn(f64) -> f64) -> Vec<(f64, f64)> {
        [6.0, 8.0, 10.0, 12.0, 16.0].map(|x| (x, law(x))).to_vec()
    }

    #[test]
    fn either_law_is_recognised_with_its_parameter() {
        let power = Growth::fit(&points(|x| 0.3 * x.powf(2.1))).unwrap();
        assert_eq!(power.law(), GrowthLaw::Power);
        assert!((power.exponent - 2.1).abs() < 1e-12 && power.power_residual < 1e-12);
        let exponential = Growth::fit(&points(|x| 0.3 * 1.25_f64.powf(x))).unwrap();
        assert_eq!(exponential.law(), GrowthLaw::Exponential);
        assert!((exponential.factor_per_unit - 1.25).abs() < 1e-12 && exponential.exponential_residual < 1e-12);
    }

    #[test]
    fn too_little_to_go_by_gives_no_law() {
        assert_eq!(Growth::fit(&[(1.0, 2.0), (2.0, 4.0), (2.0, 4.1)]), None);
        assert_eq!(Growth::fit(&[(1.0, 2.0), (2.0, 0.0), (3.0, 4.0)]), None);
        assert_eq!(Growth::fit(&[(1.0, 2.0), (2.0, f64::NAN), (3.0, 4.0)]), None);
    }
}
