-- Questions to many campaigns at once, for DuckDB (pip install duckdb==2.0.1). `tables` is a pattern of Parquet files:
-- one file a campaign or a shard; union_by_name, for arms of other joints have other columns.
create or replace view runs as
    select *, filename as campaign from read_parquet(getvariable('tables'), union_by_name = true, filename = true);

-- How runs ended, and the error that is left; with the largest error that any run's 95 % of targets had.
select campaign, count(*) as runs,
       count(*) filter (status = 'accepted') as accepted,
       count(*) filter (contacts > 0) as with_contacts,
       round(1e3 * median(tool_error_after_median_m), 2) as tool_mm,
       round(1e3 * max(tool_error_after_p95_m), 2) as worst_p95_mm
from runs group by campaign order by campaign;

-- Accepted runs whose tool was farther off than three times what they predicted: the command that repeats each.
select campaign, seed, round(1e3 * tool_error_after_p95_m, 2) as tool_mm,
       round(1e3 * predicted_tool_error_p95_m, 2) as predicted_mm, command
from runs where status = 'accepted' and tool_error_after_p95_m > 3 * predicted_tool_error_p95_m
order by tool_mm desc limit 10;

-- What refusals and failures say, with how often.
select status, stage, failure, count(*) as runs, min(seed) as first_seed
from runs where status <> 'accepted' group by status, stage, failure order by runs desc limit 10;
