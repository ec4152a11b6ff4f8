% One white-phase snapshot of a focused plenoptic camera by plain fft2, n x n samples, double precision.
% octave-cli plenoptic_snapshot.m N PITCH WAVELENGTH Z1 L B F D LENSLET_PITCH LENSLET_F COUNT
% prints the seconds of each of COUNT snapshots; transfer functions and lens phases are built before.
args = cellfun(@str2double, argv(), "UniformOutput", true);
values = num2cell(args);
[n, pitch, wavelength, z1, L, b, f, D, p, flens, count] = values{:};
x = ((0:n-1) - floor(n/2)) * pitch;
[X, Y] = meshgrid(x, x);
k = ifftshift(((0:n-1) - floor(n/2)) / (n * pitch));
function H = transfer(k, z, wavelength)
  [KX, KY] = meshgrid(k, k);
  s = (wavelength * KX) .^ 2 + (wavelength * KY) .^ 2;
  H = exp(2i * pi * z / wavelength * sqrt(max(1 - s, 0)));
  limit = 1 / (wavelength * sqrt((2 * z * (k(2) - k(1))) ^ 2 + 1));
  H(abs(KX) > limit | abs(KY) > limit) = 0;
end
H1 = transfer(k, z1, wavelength); H2 = transfer(k, L, wavelength); H3 = transfer(k, b, wavelength);
main = exp(-1i * pi * (X .^ 2 + Y .^ 2) / (wavelength * f)) .* (X .^ 2 + Y .^ 2 <= (D / 2) ^ 2);
U = mod(X + p / 2, p) - p / 2; V = mod(Y + p / 2, p) - p / 2;
array = exp(-1i * pi * (U .^ 2 + V .^ 2) / (wavelength * flens)) .* (U .^ 2 + V .^ 2 <= (p / 2) ^ 2);
clear X Y U V;
object = double(mod(floor((0:n-1)' / 40), 2) * ones(1, n));
total = zeros(n);
for snapshot = 1:count
  tic;
  field = object .* exp(2i * pi * rand(n));
  field = ifft2(fft2(field) .* H1) .* main;
  field = ifft2(fft2(field) .* H2) .* array;
  field = ifft2(fft2(field) .* H3);
  total = total + abs(field) .^ 2;
  printf("%.6f\n", toc); fflush(stdout);
end
