use std::path::Path;

use super::TradeOffLook;
use crate::{
    app::shared::{FileTask, FileWords},
    evaluation::TradeOffLevel,
    export::{
        atomic_write,
        figures::{PictureError, PictureFormat},
        write_trade_off,
    },
    figure::trade_off_figure,
};

/// File that can be written about a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum TradeOffFile {
    /// Every point of every level of noise, as CSV.
    Points,
    /// Both charts of the level on show.
    Charts(PictureFormat),
}

impl TradeOffFile {
    /// In the order offered.
    pub const ALL: [Self; 3] = [
        Self::Points,
        Self::Charts(PictureFormat::Svg),
        Self::Charts(PictureFormat::Png),
    ];

    /// Returns the words that describe the file.
    pub fn words(self) -> FileWords {
        let charts = "Both charts at the displayed noise level, on a light background, at publication size.";
        let (name, kind, description, extensions): (_, _, _, &[&str]) = match self {
            Self::Points => (
                "All points as CSV…",
                "points",
                "Every point at every noise level, in full precision, as CSV.",
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
    pub fn task(self, levels: Vec<TradeOffLevel>, look: &TradeOffLook) -> FileTask {
        let words = self.words();
        let suggestion = format!("trade_off.{}", words.extensions[0]);
        let charts = levels
            .get(look.level)
            .map(|level| trade_off_figure(level, &look.limits));
        let write = move |path: &Path| -> Result<(), PictureError> {
            match (self, &charts) {
                (Self::Charts(format), Some(charts)) => charts.draw().save(format, path)?,
                _ => atomic_write(path, |writer| write_trade_off(&levels, writer))?,
            }
            Ok(())
        };
        FileTask::save(words, suggestion, write)
    }
}
