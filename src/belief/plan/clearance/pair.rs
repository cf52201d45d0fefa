//! Pairs of shapes that may touch.

/// Two shapes that may touch; the one that more joints move comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pair {
    /// A link's shape and a static one.
    Standing { moving: usize, standing: usize },
    /// Two links' shapes, the outer first.
    Links { outer: usize, inner: usize },
}

impl Pair {
    /// Index of the moving shape that more joints move.
    pub(crate) fn outer(self) -> usize {
        match self {
            Self::Standing { moving, .. } => moving,
            Self::Links { outer, .. } => outer,
        }
    }

    /// Returns a bit for each moving shape of the pair.
    pub(crate) fn mask(self) -> u64 {
        match self {
            Self::Standing { moving, .. } => 1 << moving,
            Self::Links { outer, inner } => 1 << outer | 1 << inner,
        }
    }
}

/// The bodies of a pair: a joint moves the outer one against the other if it is one of `first_joint..outer_body`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyPair {
    pub first_joint: usize,
    pub outer_body: usize,
}
