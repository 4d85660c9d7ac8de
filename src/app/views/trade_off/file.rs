use std::path::Path;

use crate::{
    evaluation::{TradeCost, TradeLevel},
    export::{
        atomic_write,
        figures::{PictureError, PictureFormat},
        trade_plot, write_trade,
    },
};

/// What can be written about a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TradeFile {
    /// Every point of every level of noise, as CSV.
    Points,
    /// The chart of the level on show.
    Figure(TradeCost, PictureFormat),
}

impl TradeFile {
    /// In the order offered.
    pub const ALL: [Self; 5] = [
        Self::Points,
        Self::Figure(TradeCost::Decoding, PictureFormat::Svg),
        Self::Figure(TradeCost::Decoding, PictureFormat::Png),
        Self::Figure(TradeCost::Training, PictureFormat::Svg),
        Self::Figure(TradeCost::Training, PictureFormat::Png),
    ];

    /// The words on its button.
    pub fn name(self) -> &'static str {
        match self {
            Self::Points => "All points as CSV…",
            Self::Figure(TradeCost::Decoding, PictureFormat::Svg) => "Decoding chart as SVG…",
            Self::Figure(TradeCost::Decoding, PictureFormat::Png) => "Decoding chart as PNG…",
            Self::Figure(TradeCost::Training, PictureFormat::Svg) => "Training chart as SVG…",
            Self::Figure(TradeCost::Training, PictureFormat::Png) => "Training chart as PNG…",
        }
    }

    /// What the file holds, in a word or two.
    pub fn file_kind(self) -> &'static str {
        match self {
            Self::Points => "points",
            Self::Figure(..) => "chart",
        }
    }

    /// What the file is, in a sentence.
    pub fn description(self) -> &'static str {
        match self {
            Self::Points => "Every point at every level of noise with all its digits, as CSV.",
            Self::Figure(..) => "The chart of the level of noise on show, on a light ground, at publication size.",
        }
    }

    /// File name extension, without the dot.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Points => "csv",
            Self::Figure(_, format) => format.extension(),
        }
    }

    /// The name of the file, unless the user says otherwise.
    pub fn file_name(self) -> String {
        let word = match self {
            Self::Points => "trade",
            Self::Figure(TradeCost::Decoding, _) => "trade_decoding",
            Self::Figure(TradeCost::Training, _) => "trade_training",
        };
        format!("{word}.{}", self.extension())
    }

    /// Writes the file; `shown` is the place of the level on show.
    ///
    /// # Errors
    /// The file cannot be written; nothing is left half-written.
    pub fn write(self, levels: &[TradeLevel], shown: usize, path: &Path) -> Result<(), PictureError> {
        match (self, levels.get(shown)) {
            (Self::Figure(cost, format), Some(level)) => trade_plot(level, cost).draw().save(format, path)?,
            _ => atomic_write(path, |writer| write_trade(levels, writer))?,
        }
        Ok(())
    }
}
