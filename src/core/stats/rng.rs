//! Random streams by name.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

/// Returns the generator of the stream `name` under `master_seed`; the same on every platform.
#[must_use]
pub fn stream_rng(master_seed: u64, name: &str) -> ChaCha8Rng {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&master_seed.to_le_bytes());
    hasher.update(name.as_bytes());
    ChaCha8Rng::from_seed(*hasher.finalize().as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;

    #[test]
    fn streams_differ_by_name_and_seed_and_repeat() {
        let first = |seed, name| stream_rng(seed, name).next_u64();
        assert_eq!(first(1, "camera"), first(1, "camera"));
        assert_ne!(first(1, "camera"), first(1, "pot"));
        assert_ne!(first(1, "camera"), first(2, "camera"));
    }
}
