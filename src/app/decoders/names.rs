use crate::evaluation::{DecoderKind, Precision};

/// The way of decoding, as every table, chart and form calls it.
pub fn decoder_name(kind: DecoderKind, precision: Precision) -> &'static str {
    match (kind, precision) {
        (DecoderKind::Mean, _) => "Training mean",
        (DecoderKind::Ridge, _) => "Ridge",
        (DecoderKind::Network, Precision::Double) => "Network",
        (DecoderKind::Network, Precision::Single) => "Network f32",
        (DecoderKind::RadialBasis, _) => "Radial basis",
        (DecoderKind::Fuzzy, _) => "Fuzzy",
        (DecoderKind::Newton, _) => "Newton",
        (DecoderKind::Polish, _) => "Network + Newton",
    }
}
