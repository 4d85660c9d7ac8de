/// A term of the field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Term {
    /// Name, as it is in the window.
    pub name: &'static str,
    /// Definition in one or two sentences, with the unit.
    pub definition: &'static str,
    /// Equation; empty for none.
    pub equation: &'static str,
    /// Definition and equation: what stands under the pointer.
    pub hint: &'static str,
}

impl Term {
    /// Returns true if every word of `typed` occurs in the name or the definition, in any order.
    pub fn matches(&self, typed: &str) -> bool {
        let text = format!("{} {}", self.name, self.definition).to_lowercase();
        typed.split_whitespace().all(|word| text.contains(&word.to_lowercase()))
    }
}

/// Defines the terms of a group: for each its name, its definition, and its equation if it has one.
macro_rules! terms {
    ($GROUP:ident: $($TERM:ident = $name:literal, $definition:literal $(, $equation:literal)?;)*) => {
        $(
            #[doc = $definition]
            pub const $TERM: crate::window::glossary::Term = crate::window::glossary::Term {
                name: $name,
                definition: $definition,
                equation: concat!("" $(, $equation)?),
                hint: concat!($definition $(, "\n\n", $equation)?),
            };
        )*

        /// The terms of this group.
        pub(super) const $GROUP: &[crate::window::glossary::Term] = &[$($TERM),*];
    };
}
pub(super) use terms;
