use super::bottom_tab::BottomTab;
use decoupler_core::{evaluation::SimulatedSettings, sensor::SensorModel};
use decoupler_files::figure::surface::ViewMode;

/// A figure of the paper that the window can show: its configuration, trained and looked at in its way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PaperFigure {
    /// Surfaces of 10×10_5×30 from above.
    Four,
    /// Nodes of 10×6_3×18.
    Six,
    /// Surfaces of 10×6_3×18 in space.
    Seven,
    /// The same from above.
    Eight,
}

impl PaperFigure {
    /// In the paper's order.
    pub const ALL: [Self; 4] = [Self::Four, Self::Six, Self::Seven, Self::Eight];

    /// Its array and the way in which it is seen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Four => "10×10, top view",
            Self::Six => "10×6, nodes",
            Self::Seven => "10×6, 3-D",
            Self::Eight => "10×6, top view",
        }
    }

    /// Returns a description of the figure in a sentence.
    pub fn description(self) -> &'static str {
        match self {
            Self::Four => {
                "Fig. 4: trains 10×10_5×30 with 12 hidden nodes and shows actual and decoupled surface from above. Unlike the \
                 paper's spline, ours includes a plane: level nodes give a level surface."
            }
            Self::Six => {
                "Fig. 6: trains 10×6_3×18 with 12 hidden nodes and shows every node: actual as squares, decoupled as \
                 discs."
            }
            Self::Seven => {
                "Fig. 7: trains 10×6_3×18 with 12 hidden nodes and shows actual and decoupled surface in space. Unlike the \
                 paper's spline, ours includes a plane: level nodes give a level surface."
            }
            Self::Eight => {
                "Fig. 8: trains 10×6_3×18 with 12 hidden nodes and shows actual and decoupled surface from above. Unlike the \
                 paper's spline, ours includes a plane: level nodes give a level surface."
            }
        }
    }

    /// Returns the settings of the training for the figure.
    pub fn settings(self) -> SimulatedSettings {
        let scale = match self {
            Self::Four => "10×10_5×30",
            Self::Six | Self::Seven | Self::Eight => "10×6_3×18",
        };
        let scale = scale.parse().expect("the paper's arrays are possible");
        let mut settings = SimulatedSettings::default();
        settings.source.sensor = SensorModel::new(scale);
        settings
    }

    /// From where its surfaces are seen; `None` where it shows none.
    pub fn mode(self) -> Option<ViewMode> {
        match self {
            Self::Four | Self::Eight => Some(ViewMode::Top),
            Self::Seven => Some(ViewMode::ThreeD),
            Self::Six => None,
        }
    }

    /// Its chart; `None` where it shows none.
    pub fn tab(self) -> Option<BottomTab> {
        (self == Self::Six).then_some(BottomTab::Nodes)
    }
}
