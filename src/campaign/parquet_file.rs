//! Rows as Parquet: the same columns as the CSV, with types.

use std::path::Path;
use std::sync::Arc;

use arrow::array::{ArrayRef, Float64Array, StringArray, UInt8Array, UInt32Array, UInt64Array};
use arrow::record_batch::RecordBatch;
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;

use crate::campaign::columns::Columns;
use crate::campaign::{CampaignError, Row, Table};
use crate::output;
use armcal_core::units::Unit;

/// Writes the file; the same rows give the same bytes.
pub(super) fn write_parquet(path: &Path, table: &Table) -> Result<(), CampaignError> {
    let bytes = parquet_bytes(table).map_err(|source| CampaignError::Parquet { path: path.to_owned(), source })?;
    Ok(output::write_whole(path, &bytes)?)
}

fn parquet_bytes(table: &Table) -> Result<Vec<u8>, ParquetError> {
    let batch = batch(table).map_err(|error| ParquetError::ArrowError(error.to_string()))?;
    let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, batch.schema(), Some(properties))?;
    writer.write(&batch)?;
    writer.close()?;
    Ok(bytes)
}

fn batch(table: &Table) -> Result<RecordBatch, arrow::error::ArrowError> {
    let rows = &table.rows;
    let text = |of: fn(&Row) -> &str| -> ArrayRef { Arc::new(StringArray::from_iter_values(rows.iter().map(of))) };
    let some_text = |of: fn(&Row) -> &str| -> ArrayRef {
        Arc::new(rows.iter().map(|row| Some(of(row)).filter(|text| !text.is_empty())).collect::<StringArray>())
    };
    let mut columns: Vec<(&str, ArrayRef, bool)> = vec![
        ("setting", Arc::new(UInt32Array::from_iter_values(rows.iter().map(|row| row.setting))), false),
        ("settings", text(|row| &row.settings), false),
        ("seed", Arc::new(UInt64Array::from_iter_values(rows.iter().map(|row| row.seed))), false),
        ("status", text(|row| row.status.name()), false),
        ("exit_code", Arc::new(UInt8Array::from_iter_values(rows.iter().map(|row| row.exit_code))), false),
        ("stage", some_text(|row| &row.stage), true),
        ("failure", some_text(|row| &row.failure), true),
        ("command", text(|row| &row.command), false),
    ];
    for (index, name) in table.names.iter().enumerate() {
        let values = rows.iter().map(|row| row.figures.get(index).copied().flatten());
        let array: ArrayRef = match Columns::unit(name) {
            Unit::Count => Arc::new(values.map(|v| v.map(|v| v as u64)).collect::<UInt64Array>()),
            _ => Arc::new(values.collect::<Float64Array>()),
        };
        columns.push((name, array, true));
    }
    RecordBatch::try_from_iter_with_nullable(columns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::table_file::tests::{names, row};
    use arrow::array::Array;
    use arrow::datatypes::DataType;

    #[test]
    fn columns_have_types_and_missing_values_are_null() {
        let failed = Row { figures: vec![None; 3], failure: "why".to_owned(), ..row(1, u64::MAX) };
        let table = Table { names: names(), rows: vec![row(0, 1), failed] };
        let batch = batch(&table).expect("a batch");
        let types: Vec<DataType> = batch.schema().fields().iter().map(|field| field.data_type().clone()).collect();
        use DataType::{Float64, UInt8, UInt32, UInt64, Utf8};
        assert_eq!(types, [UInt32, Utf8, UInt64, Utf8, UInt8, Utf8, Utf8, Utf8, Float64, UInt64, Float64]);
        let seeds = batch.column(2).as_any().downcast_ref::<UInt64Array>().expect("seeds");
        assert_eq!(seeds.values(), &[1, u64::MAX]);
        let contacts = batch.column(9).as_any().downcast_ref::<UInt64Array>().expect("contacts");
        assert_eq!((contacts.value(0), contacts.is_null(1)), (3, true));
        assert!(batch.column(6).is_null(0) && !batch.column(6).is_null(1));
        let bytes = parquet_bytes(&table).expect("bytes");
        assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"));
        assert!(bytes == parquet_bytes(&table).expect("bytes"));
        assert!(parquet_bytes(&Table { rows: Vec::new(), ..table }).is_ok(), "no rows are a table, too");
    }
}
