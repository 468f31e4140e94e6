function run = read_samples(run_dir)
% READ_SAMPLES  The samples of a run folder, in MATLAB and in Octave.
%
%   run = read_samples('runs/first')
%
% returns a struct with one column vector per column of the log (run.time, run.x1, ...), run.sequence (number of each row;
% a gap means lost rows) and run.units, a struct with the same names. It reads up to the last complete row that carries its
% mark and follows the one before. `gusset export --format mat` also checks the checksum of every row.

layout = jsondecode(fileread(fullfile(run_dir, 'samples.json')));
names = {layout.columns.name};
file = fopen(fullfile(run_dir, 'samples.bin'), 'r', 'ieee-le');
if file < 0
    error('read_samples:none', '%s has no samples.bin', run_dir);
end
closing = onCleanup(@() fclose(file));
stride = layout.stride;
bytes = fread(file, Inf, '*uint8');
rows = floor(numel(bytes) / stride);
bytes = reshape(bytes(1:stride * rows), stride, rows);    % the last row may be torn
marks = bytes(stride - 3:stride, :);
sound = all(marks == repmat(uint8(sprintf('ROW\n'))', 1, rows), 1);
sequence = typecast(reshape(bytes(1:8, :), [], 1), 'uint64');
sound = sound(:) & [true(min(rows, 1), 1); sequence(2:end) > sequence(1:end - 1)];
rows = find([~sound; true], 1) - 1;                % nothing behind a damaged row is read
run.sequence = sequence(1:rows);
for k = 1:numel(names)
    place = layout.columns(k).offset;
    values = typecast(reshape(bytes(place + (1:8), 1:rows), [], 1), 'double');
    run.(names{k}) = reshape(values, [], 1);
    run.units.(names{k}) = layout.columns(k).unit;
end
end
