//! Recordings with a valid file and invalid messages.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use armcal::log::for_each_raw;
use rand::RngExt;

use super::bytes::mutated;

/// The recording with some of its messages changed, lost, doubled or moved to another time.
pub fn with_changed_messages(seed: &Path, rng: &mut impl RngExt) -> Vec<u8> {
    let mut out = Vec::new();
    let options = mcap::WriteOptions::new().compression(None).compression_threads(0);
    let mut writer = options.create(Cursor::new(&mut out)).expect("begun");
    let mut channels: BTreeMap<String, u16> = BTreeMap::new();
    let share = [0.001, 0.01, 0.1][rng.random_range(0..3)];
    for_each_raw(seed, |message| {
        let topic = &message.channel.topic;
        let channel_id = *channels.entry(topic.clone()).or_insert_with(|| {
            let schema = message.channel.schema.as_ref().expect("a schema");
            let schema = writer.add_schema(&schema.name, "ros2msg", &schema.data).expect("a schema");
            writer.add_channel(schema, topic, "cdr", &BTreeMap::new()).expect("a channel")
        });
        let mut log_time = message.log_time_nanos;
        let mut data = message.data.to_vec();
        let mut times = 1;
        if rng.random_bool(share) {
            match rng.random_range(0..8) {
                0 => times = 0,
                1 => times = 2,
                2 => log_time = log_time.saturating_add_signed(rng.random_range(-10_000_000_000..10_000_000_000)),
                3 => data = mutated(&data, rng),
                // A number of eight bytes, at any offset.
                _ if data.len() > 20 => {
                    let at = rng.random_range(4..data.len() - 8);
                    let values = [f64::NAN, f64::INFINITY, 0.0, -1.0, 1e300, 1e-300, 1e6];
                    let value = values[rng.random_range(0..values.len())];
                    data[at..at + 8].copy_from_slice(&value.to_le_bytes());
                }
                _ => data.clear(),
            }
        }
        for _ in 0..times {
            let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time, publish_time: log_time };
            writer.write_to_known_channel(&header, &data).expect("written");
        }
    })
    .expect("the corpus reads");
    writer.finish().expect("finished");
    drop(writer);
    out
}
