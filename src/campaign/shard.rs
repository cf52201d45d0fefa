//! A share of a campaign's seeds, for one of several machines.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// The `k`-th of `n` shares, counted from 1: every n-th seed, beginning with the k-th.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Shard {
    k: u64,
    n: u64,
}

impl Shard {
    /// True if the seed at `place` in the range, from 0, is in this share.
    #[must_use]
    pub fn takes(self, place: u64) -> bool {
        place % self.n == self.k - 1
    }

    /// All shares of the campaign to which this one belongs, in order.
    pub fn all(self) -> impl Iterator<Item = Self> {
        (1..=self.n).map(move |k| Self { k, ..self })
    }
}

/// Identity of a shard in its summary: its share, and the range of all seeds.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Share {
    pub shard: Shard,
    /// First and last seed of all shares together.
    pub seeds: [u64; 2],
}

impl TryFrom<String> for Shard {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> Self {
        shard.to_string()
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let problem = || format!("`{text}` is not K/N with K from 1 to N");
        let (k, n) = text.split_once('/').ok_or_else(problem)?;
        let parse = |part: &str| part.parse::<u64>().map_err(|_| problem());
        let (k, n) = (parse(k)?, parse(n)?);
        if k == 0 || k > n { Err(problem()) } else { Ok(Self { k, n }) }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.k, self.n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_take_each_seed_once() {
        for n in 1..7_u64 {
            for place in 0..40 {
                let takers = (1..=n).filter(|k| Shard { k: *k, n }.takes(place)).collect::<Vec<_>>();
                assert_eq!(takers, [place % n + 1], "{n} shards");
            }
        }
    }

    #[test]
    fn a_shard_is_one_of_some() {
        assert_eq!("2/3".parse(), Ok(Shard { k: 2, n: 3 }));
        for bad in ["0/3", "4/3", "1/0", "1", "/", "1/2/3", "-1/2", "a/b"] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}
