/// Replaces each value by its hyperbolic tangent, within 3 units in the last place.
///
/// With y = 2|x|, tanh|x| = (eʸ − 1) / (eʸ − 1 + 2), computed from the two parts of eʸ. There are no branches, so that
/// the loop vectorises, and no fused operations, so that results are bit-identical on every machine.
pub fn tanh_in_place(values: &mut [f64]) {
    pulp::Arch::new().dispatch(|| {
        for value in &mut *values {
            *value = tanh(*value);
        }
    });
}

#[inline(always)]
pub(crate) fn tanh(x: f64) -> f64 {
    /// Beyond 2|x| = 40 the result rounds to ±1.
    const SATURATED: f64 = 40.0;
    let twice = 2.0 * x.abs();
    // Written so that NaN passes through.
    let (power, less_one) = parts(if twice > SATURATED { SATURATED } else { twice });
    let exponential_less_one = power * less_one + (power - 1.0);
    (exponential_less_one / (exponential_less_one + 2.0)).copysign(x)
}

/// Hyperbolic tangent in single precision, within 4 units in the last place.
///
/// Uses the method of [`tanh_in_place`].
#[inline(always)]
pub fn tanh_single(x: f32) -> f32 {
    /// ln 2 in two parts; products of the first with an integer up to 2¹⁵ are exact.
    const LN2_HIGH: f32 = 0.693_359_4;
    const LN2_LOW: f32 = -2.121_944_4e-4;
    /// Adding 1.5·2²³ leaves the nearest integer in the low bits.
    const ROUND: f32 = 12_582_912.0;
    /// Beyond 2|x| = 20 the result rounds to ±1.
    const SATURATED: f32 = 20.0;
    /// The remainder is below 1e-8.
    const COEFFICIENTS: [f64; 6] = inverse_factorials();
    let twice = 2.0 * x.abs();
    // Written so that NaN passes through.
    let y = if twice > SATURATED { SATURATED } else { twice };
    let shifted = y * std::f32::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let r = (y - k * LN2_HIGH) - k * LN2_LOW;
    let mut tail = COEFFICIENTS[0] as f32;
    for coefficient in &COEFFICIENTS[1..] {
        tail = tail * r + *coefficient as f32;
    }
    let less_one = r + r * r * tail;
    let power = f32::from_bits((shifted.to_bits() << 23).wrapping_add(127 << 23));
    let exponential_less_one = power * less_one + (power - 1.0);
    (exponential_less_one / (exponential_less_one + 2.0)).copysign(x)
}

/// Returns eˣ within 2 units in the last place for x from −708 to 709; below −708 it returns the value at −708.
#[inline(always)]
pub(crate) fn exp(x: f64) -> f64 {
    /// Below this, powers of two are subnormal.
    const LOWEST: f64 = -708.0;
    // Written so that NaN passes through.
    let (power, less_one) = parts(if x < LOWEST { LOWEST } else { x });
    power * (1.0 + less_one)
}

/// Returns the parts 2ᵏ and eʳ − 1 of eˣ = 2ᵏ eʳ for x from −708 to 709.
///
/// x is split into k·ln 2 + r, |r| ≤ ½ ln 2; eʳ − 1 is its Taylor polynomial of degree 13 (remainder below 1e-17).
/// There are no branches, so that loops over it vectorise, and no fused operations, so that results are bit-identical
/// on every machine.
#[inline(always)]
pub(super) fn parts(x: f64) -> (f64, f64) {
    /// ln 2 in two parts; products of the first with an integer up to 2¹¹ are exact.
    const LN2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    /// Adding 1.5·2⁵² leaves the nearest integer in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    const COEFFICIENTS: [f64; 12] = inverse_factorials();
    let shifted = x * std::f64::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let r = (x - k * LN2_HIGH) - k * LN2_LOW;
    let mut tail = COEFFICIENTS[0];
    for coefficient in &COEFFICIENTS[1..] {
        tail = tail * r + coefficient;
    }
    let power = f64::from_bits((shifted.to_bits() << 52).wrapping_add(1023 << 52));
    (power, r + r * r * tail)
}

/// Returns 1/n! from n = N + 1 down to 2, the coefficients of eʳ.
const fn inverse_factorials<const N: usize>() -> [f64; N] {
    let (mut all, mut factorial, mut n) = ([0.0; N], 1.0, 2);
    while n < N + 2 {
        factorial *= n as f64;
        all[N + 1 - n] = 1.0 / factorial;
        n += 1;
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_standard_library_everywhere() {
        let magnitudes = (0..=20_000)
            .map(|i| f64::from(i) * 1e-3)
            .chain((0..320).map(|e| 10.0_f64.powi(-e)));
        for x in magnitudes.flat_map(|x| [x, -x]) {
            let mut ours = [x];
            tanh_in_place(&mut ours);
            assert!(
                (ours[0] - x.tanh()).abs() <= 3.0 * f64::EPSILON * x.tanh().abs(),
                "{x}: {} {}",
                ours[0],
                x.tanh()
            );
        }
    }

    #[test]
    fn saturates_keeps_signs_and_passes_nan() {
        let mut values = [1e308, f64::INFINITY, -1e308, f64::NEG_INFINITY, -0.0, 30.0];
        tanh_in_place(&mut values);
        assert_eq!(values, [1.0, 1.0, -1.0, -1.0, 0.0, 1.0]);
        assert!(values[4].is_sign_negative());
        let mut nan = [f64::NAN];
        tanh_in_place(&mut nan);
        assert!(nan[0].is_nan());
    }

    #[test]
    fn exponentials_agree_with_the_standard_library_and_end_where_they_are_subnormal() {
        for x in (-708..=709).map(f64::from) {
            assert!((exp(x) / x.exp() - 1.0).abs() <= 4.0 * f64::EPSILON, "{x}: {}", exp(x));
        }
        assert_eq!([exp(-800.0), exp(f64::NEG_INFINITY)], [exp(-708.0); 2]);
        assert!(exp(f64::NAN).is_nan());
    }

    #[test]
    fn single_precision_agrees_with_double() {
        let magnitudes = (0..=20_000)
            .map(|i| i as f32 * 1e-3)
            .chain((0..38).map(|e| 10.0_f32.powi(-e)))
            .chain([f32::INFINITY, f32::MAX]);
        for x in magnitudes.flat_map(|x| [x, -x]) {
            let mut ours = [x];
            ours.iter_mut().for_each(|value| *value = tanh_single(*value));
            let exact = f64::from(x).tanh();
            let error = (f64::from(ours[0]) - exact).abs();
            assert!(
                error <= 4.0 * f64::from(f32::EPSILON) * exact.abs(),
                "{x}: {} {exact}",
                ours[0]
            );
        }
        let mut nan = [f32::NAN];
        nan.iter_mut().for_each(|value| *value = tanh_single(*value));
        assert!(nan[0].is_nan());
    }

    #[test]
    fn agrees_with_the_standard_library_where_powers_of_two_are_normal() {
        let arguments = (-7080..=7090).map(|i| f64::from(i) * 0.1);
        for x in arguments.chain((0..320).flat_map(|e| [10.0_f64.powi(-e), -(10.0_f64.powi(-e))])) {
            let (ours, theirs) = (exp(x), x.exp());
            assert!(
                (ours - theirs).abs() <= 2.0 * f64::EPSILON * theirs,
                "{x}: {ours} {theirs}"
            );
        }
    }

    #[test]
    fn large_negative_values_give_almost_zero_and_nan_is_kept() {
        assert!(exp(-1e300) < 1e-307 && exp(f64::NEG_INFINITY) < 1e-307);
        assert!(exp(f64::NAN).is_nan());
    }
}
