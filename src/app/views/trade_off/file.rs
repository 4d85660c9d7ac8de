use std::path::Path;

use super::TradeLook;
use crate::{
    app::shared::{FileTask, FileWords},
    evaluation::TradeLevel,
    export::{
        atomic_write,
        figures::{PictureError, PictureFormat},
        write_trade,
    },
    figure::trade_off_figure,
};

/// What can be written about a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TradeFile {
    /// Every point of every level of noise, as CSV.
    Points,
    /// Both charts of the level on show.
    Charts(PictureFormat),
}

impl TradeFile {
    /// In the order offered.
    pub const ALL: [Self; 3] = [
        Self::Points,
        Self::Charts(PictureFormat::Svg),
        Self::Charts(PictureFormat::Png),
    ];

    /// What the file is called.
    pub fn words(self) -> FileWords {
        let charts = "Both charts of the level of noise on show, on a light ground, at publication size.";
        let (name, kind, description, extensions): (_, _, _, &[&str]) = match self {
            Self::Points => (
                "All points as CSV…",
                "points",
                "Every point at every level of noise with all its digits, as CSV.",
                &["csv"],
            ),
            Self::Charts(PictureFormat::Svg) => ("Charts as SVG…", "charts", charts, &["svg"]),
            Self::Charts(PictureFormat::Png) => ("Charts as PNG…", "charts", charts, &["png"]),
        };
        FileWords {
            name,
            kind,
            description,
            extensions,
        }
    }

    /// The file about `levels`, looked at so.
    pub fn task(self, levels: Vec<TradeLevel>, look: &TradeLook) -> FileTask {
        let words = self.words();
        let suggestion = format!("trade_off.{}", words.extensions[0]);
        let charts = levels
            .get(look.level)
            .map(|level| trade_off_figure(level, &look.limits));
        let write = move |path: &Path| -> Result<(), PictureError> {
            match (self, &charts) {
                (Self::Charts(format), Some(charts)) => charts.draw().save(format, path)?,
                _ => atomic_write(path, |writer| write_trade(&levels, writer))?,
            }
            Ok(())
        };
        FileTask::save(words, suggestion, write)
    }
}
