//! Pairs of links that can come near each other.

/// Pairs of links that come near each other, over all configurations that planning considers.
#[derive(Clone, Debug, PartialEq)]
pub struct SelfPairs {
    /// Seed of the random configurations.
    pub seed: u64,
    /// Number of the random configurations.
    pub n: u64,
    /// Smallest distance of all other pairs, m.
    pub near_m: f64,
    /// Each pair once; neighbours along the chain are not among them.
    pub pairs: Vec<SelfPair>,
}

/// Two links that come near each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SelfPair {
    /// Numbers of the bodies, proximal first.
    pub bodies: [usize; 2],
    /// Smallest distance found, m; 0: contact.
    pub nearest_m: f64,
}

impl SelfPairs {
    /// Returns true if two bodies can come closer than `SelfPairs::near_m`.
    #[must_use]
    pub fn has(&self, inner: usize, outer: usize) -> bool {
        self.pairs.iter().any(|pair| pair.bodies == [inner, outer])
    }
}
