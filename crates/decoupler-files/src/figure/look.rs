use decoupler_core::decoupling::DecoderKind;

/// Role of a colour. The window resolves it by its theme, print by a palette for white paper; both tell the hues apart
/// in grey and for most colour-blind readers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Hue {
    /// The network's own result.
    Blue,
    /// A comparison that went wrong or differs most.
    Red,
    /// The validation set; a bound.
    Green,
    /// The test set; a second run.
    Orange,
    /// A further series.
    Violet,
    /// A further series.
    Cyan,
    /// References and baselines.
    Grey,
    /// As strong as text: published values.
    Ink,
}

impl Hue {
    /// The hue of a decoder in charts, a different one for each.
    pub fn of_decoder(kind: DecoderKind) -> Self {
        match kind {
            DecoderKind::Mean => Self::Grey,
            DecoderKind::Ridge => Self::Violet,
            DecoderKind::Network => Self::Blue,
            DecoderKind::RadialBasis => Self::Orange,
            DecoderKind::Fuzzy => Self::Cyan,
            DecoderKind::Newton => Self::Red,
            DecoderKind::Polish => Self::Green,
        }
    }
}

/// Style of a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LineStyle {
    /// A curve.
    Solid,
    /// A reference, or the lesser of two curves.
    Dashed,
    /// A limit set by the user.
    Dotted,
    /// Thin and pale: one of many.
    Fine,
}

/// Symbol at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Marker {
    /// A small filled circle: one of many.
    Dot,
    /// A filled circle.
    Disc,
    /// A hollow circle.
    Ring,
    /// A hollow circle around another symbol.
    Halo,
    /// A hollow square.
    Square,
    /// A filled diamond.
    Diamond,
    /// A hollow diamond.
    HollowDiamond,
}

/// Appearance of a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Look {
    /// Colour of everything.
    pub hue: Hue,
    /// Line from point to point.
    pub line: Option<LineStyle>,
    /// Symbol at each point.
    pub marker: Option<Marker>,
}

impl Look {
    /// A line without symbols.
    pub fn line(hue: Hue, style: LineStyle) -> Self {
        Self {
            hue,
            line: Some(style),
            marker: None,
        }
    }

    /// Symbols without a line.
    pub fn marker(hue: Hue, marker: Marker) -> Self {
        Self {
            hue,
            line: None,
            marker: Some(marker),
        }
    }

    /// Symbols joined by a solid line.
    pub fn joined(self) -> Self {
        Self {
            line: Some(LineStyle::Solid),
            ..self
        }
    }

    /// A filled area: the bars of a histogram or a span of an axis.
    pub fn area(hue: Hue) -> Self {
        Self {
            hue,
            line: None,
            marker: None,
        }
    }
}

/// Entry of a legend.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Key {
    /// Meaning of the sample.
    pub name: String,
    /// The sample.
    pub look: Look,
}

impl Key {
    /// A key of this name.
    pub fn new(name: impl Into<String>, look: Look) -> Self {
        let name = name.into();
        Self { name, look }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_tell_decoders_apart() {
        for (index, kind) in DecoderKind::ALL.into_iter().enumerate() {
            let others = &DecoderKind::ALL[..index];
            assert!(
                others
                    .iter()
                    .all(|&other| Hue::of_decoder(other) != Hue::of_decoder(kind)),
                "{kind}"
            );
        }
    }
}
