use std::path::Path;

use crate::{
    app::shared::{FileTask, FileWords},
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

    /// What the file is called.
    pub fn words(self) -> FileWords {
        let (name, extensions) = match self {
            Self::Points => ("All points as CSV…", &["csv"]),
            Self::Figure(TradeCost::Decoding, PictureFormat::Svg) => ("Decoding chart as SVG…", &["svg"]),
            Self::Figure(TradeCost::Decoding, PictureFormat::Png) => ("Decoding chart as PNG…", &["png"]),
            Self::Figure(TradeCost::Training, PictureFormat::Svg) => ("Training chart as SVG…", &["svg"]),
            Self::Figure(TradeCost::Training, PictureFormat::Png) => ("Training chart as PNG…", &["png"]),
        };
        let (kind, description) = match self {
            Self::Points => (
                "points",
                "Every point at every level of noise with all its digits, as CSV.",
            ),
            Self::Figure(..) => (
                "chart",
                "The chart of the level of noise on show, on a light ground, at publication size.",
            ),
        };
        FileWords {
            name,
            kind,
            description,
            extensions,
        }
    }

    /// The file about `levels`, of which that in the place `shown` is on show.
    pub fn task(self, levels: Vec<TradeLevel>, shown: usize) -> FileTask {
        let word = match self {
            Self::Points => "trade",
            Self::Figure(TradeCost::Decoding, _) => "trade_decoding",
            Self::Figure(TradeCost::Training, _) => "trade_training",
        };
        let words = self.words();
        let suggestion = format!("{word}.{}", words.extensions[0]);
        FileTask::save(words, suggestion, move |path| self.write(&levels, shown, path))
    }

    fn write(self, levels: &[TradeLevel], shown: usize, path: &Path) -> Result<(), PictureError> {
        match (self, levels.get(shown)) {
            (Self::Figure(cost, format), Some(level)) => trade_plot(level, cost).draw().save(format, path)?,
            _ => atomic_write(path, |writer| write_trade(levels, writer))?,
        }
        Ok(())
    }
}
