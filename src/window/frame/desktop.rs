/// Services of the desktop that the window uses: file dialogs and the clipboard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Desktop {
    /// The desktop's own.
    Native,
    /// None: the window asks for paths itself, and what is copied goes no further than the toolkit. For tests.
    None,
}
