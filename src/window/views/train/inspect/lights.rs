/// The thing under the pointer, in whatever picture: it lights up in all of them.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lighting {
    /// A node, by its number among those drawn; of a recording the target there.
    pub node: Option<usize>,
    /// A row-wire, by its place among those read: a reading is that of all its nodes.
    pub row: Option<usize>,
    /// The chosen bar of the histogram.
    pub bar: Option<usize>,
}
