"""What the design is compared with: the article's programmes, direct search, tenons, planar contacts."""
